"""Diffraction of light at height fields: geometry, evaluators of the spectral response, colours."""
