"""Derivatives: adjoints of launches, and tapes that run them."""
