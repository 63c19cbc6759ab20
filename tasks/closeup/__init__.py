"""Close-ups: frames that show little or nothing of the limb, matched to the base map."""

from tasks.closeup.choice import is_close_up
from tasks.closeup.find import find_close_up
from tasks.closeup.settings import CloseUpSettings

__all__ = ["CloseUpSettings", "find_close_up", "is_close_up"]
