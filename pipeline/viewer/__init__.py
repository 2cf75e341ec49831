"""The interactive sheet: one shader for the page's WebGL2 and for OpenGL off screen, its textures, and its script."""
