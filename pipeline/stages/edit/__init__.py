"""Stages that change maps to a designer's wish."""
