"""Stages that take photographs on a rig."""
