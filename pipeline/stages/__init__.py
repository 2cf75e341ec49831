"""Stages: plain functions that a YAML graph names as ``package.function``."""
