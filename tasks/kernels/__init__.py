"""Kernels: what was found about images as SPICE kernels that plain SPICE loads, alone or after the mission's own."""
