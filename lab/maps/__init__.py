"""Maps and control networks against planted truth: `planetpose benchmark mosaic` and `control`."""
