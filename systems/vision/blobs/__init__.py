"""Markers in images: bright round regions and their centroids."""
