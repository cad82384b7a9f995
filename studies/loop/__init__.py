"""The loop closed: diagnose, run the motion that the diagnosis proposes, diagnose again."""
