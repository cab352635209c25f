"""Monitors: small objects that each judge one kind of fault from plain numbers."""
