"""The paper's tables and figures beside ours: one module per part, one that writes the report."""
