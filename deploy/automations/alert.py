"""Tell somebody when too many images of a reprocessing run failed: make the automation, on the server at
PREFECT_API_URL.

    PLANETPOSE_ALERT_URL=https://chat.example/hooks/... python deploy/automations/alert.py

The address gets a POST of `{"text": ...}`, as chat services take it. The flow `reprocess` emits the event when more
than its parameter `most_failed_percent` (5) of the list is refused or failed; its run then ends in the state
TooManyFailed. Run it again after a change: the automation is made anew.
"""

import os
import sys

from prefect.automations import Automation
from prefect.blocks.webhook import Webhook
from prefect.client.orchestration import get_client
from prefect.events.actions import CallWebhook
from prefect.events.schemas.automations import EventTrigger, Posture
from pydantic import SecretStr

NAME = "planetpose-too-many-failed"
EVENT = "planetpose.reprocess.too-many-failed"
TEXT = (
    "planetpose: {{ event.payload.failed_percent }} % of {{ event.payload.images }} images of {{ event.payload.list }} "
    "have no product: {{ event.payload.codes }}. See `planetpose status {{ event.payload.store }}`."
)


def main(url: str) -> None:
    """Make block and automation, or make them anew."""
    block = Webhook(method="POST", url=SecretStr(url))
    block_id = block.save(NAME, overwrite=True)
    with get_client(sync_client=True) as client:
        for old in client.read_automations_by_name(NAME):
            client.delete_automation(old.id)
    Automation(
        name=NAME,
        description="More images failed than a reprocessing run tolerates.",
        trigger=EventTrigger(expect={EVENT}, posture=Posture.Reactive, threshold=1),
        actions=[CallWebhook(block_document_id=block_id, payload='{"text": "' + TEXT + '"}')],
    ).create()


if __name__ == "__main__":
    if not os.environ.get("PLANETPOSE_ALERT_URL"):
        sys.exit("PLANETPOSE_ALERT_URL: set it to the address that receives alerts")
    main(os.environ["PLANETPOSE_ALERT_URL"])
