"""Scenes and pictures in files: stages by `usd`, shapes on them by `shapes`, PNG by `pictures`."""
