"""Sheets under a small flash: where its mirror image lies, and where orders of diffraction are bright."""
