"""Ingest: read the image file, and find the pose that the metadata claim."""
