"""Memory of processes, where the system tells it (Linux); None elsewhere."""

from pathlib import Path

PROC = Path("/proc")


def reset_peak() -> None:
    """Begin to measure this process's peak anew."""
    try:
        (PROC / "self" / "clear_refs").write_text("5")
    except OSError:
        return


def peak_mb() -> float | None:
    """Largest resident size of this process since `reset_peak`."""
    return _field("self", "VmHWM:")


def resident_mb(pid: int | str = "self") -> float | None:
    """Resident size of a process; None when it is gone too."""
    return _field(str(pid), "VmRSS:")


def _field(pid: str, name: str) -> float | None:
    try:
        for line in (PROC / pid / "status").read_text().splitlines():
            if line.startswith(name):
                return round(int(line.split()[1]) / 1024, 1)
    except (OSError, ValueError):
        return None
    return None
