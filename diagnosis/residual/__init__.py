"""Residuals of a fit: noise, intervals, spectra, joints and regimes, structure that no effect explains."""
