"""Project: what every pixel sees on the ellipsoid, and the curves that pictures show (paper, section 6)."""
