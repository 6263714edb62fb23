"""Families of controllers fitted to recordings of standing people."""
