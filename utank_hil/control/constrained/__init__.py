"""Predictive laws that plan within the limits of pump and tank."""
