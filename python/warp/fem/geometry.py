"""Geometries that are made of fields, and reports of bad cells."""

from warp._src.fem.geometry.check import GeometryReport as GeometryReport
from warp._src.fem.geometry.deformed import DeformedGeometry as DeformedGeometry
