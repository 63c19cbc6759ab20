"""Astrometry: where bodies are seen among the stars, as tables that orbit determination reads."""
