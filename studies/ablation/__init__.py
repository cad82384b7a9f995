"""Ablation of the rules of the diagnosis: each is neutralised in turn on kept cases."""
