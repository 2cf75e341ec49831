"""Registration of photographs."""
