"""The generated LCM types, found and loaded under a name of their own.

lcm-gen names its package `carom`, as this one; so it is loaded as `carom._generated` from
$CAROM_MESSAGES, or from <environment>/messages (python -m carom.build_messages).
"""

import importlib.util
import os
import sys
from pathlib import Path

from .errors import CaromError

NAMES = (
    "loss_gradient_t", "parameter_gradient_t", "reply_t", "scene_chunk_t", "scene_t",
    "session_request_t", "state_t", "status_t", "step_request_t",
)


def _folders():
    if os.environ.get("CAROM_MESSAGES"):
        yield Path(os.environ["CAROM_MESSAGES"])
    yield Path(sys.prefix) / "messages"


def _load():
    for folder in _folders():
        package = folder / "carom"
        if not (package / "__init__.py").exists():
            continue
        spec = importlib.util.spec_from_file_location(
            "carom._generated", package / "__init__.py", submodule_search_locations=[str(package)])
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        spec.loader.exec_module(module)
        return module
    looked = ", ".join(str(folder) for folder in _folders())
    raise CaromError(
        f"the message types are not there (looked in {looked}); "
        "make them with: python -m carom.build_messages")


_module = _load()
globals().update({name: getattr(_module, name) for name in NAMES})
__all__ = list(NAMES)
