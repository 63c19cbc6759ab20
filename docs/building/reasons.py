"""Every reason that a result can have, from the program's own enumeration."""

from building.markdown import code
from building.markdown import table as table_of
from catalog.reasons import reason_texts


def table(_: str = "") -> str:
    """All codes with status, meaning and remedy."""
    rows = [
        (f"{code(reason)}<br>{', '.join(text.status)}", text.meaning, text.remedy)
        for reason, text in sorted(reason_texts().items())
    ]
    return table_of(("code, status", "what was found", "what to do"), rows)
