"""Which settings `tractexp again` takes over from the folder of a run, which somebody else may have
written.

They choose what is computed. What says where anything is written or sent, what is asked of another
computer, or what is called, is the user's to say. So is what is not listed here.
"""

import re

CHOICES = (
    "data",
    "domain",
    "experiment",
    "model",
    "model/motor",
    "model/static",
    "objective",
    "optimizer",
    "task",
)
PARTS = ("data.", "model.", "objective.", "optimizer.", "task.")  # settings of what is chosen
VALUES = ("seed", "budget", "time_limit", "target", "tracking.enabled")
READ = ("task.parameters", "task.values", "task.rivals")  # of a task: files that it reads
KEY = re.compile(r"\+{0,2}([\w-]+(?:[./][\w-]+)*)")
NAMES = re.compile(r"\[?\w+(\s*,\s*\w+)*\]?|null")  # no path: Hydra would leave its folders by one
# a file of a model, of which values alone are read; Hydra keeps a path in quotes
MODEL = re.compile(r"[^$'\"]+\.ya?ml|'(?:[^$'\\]|\\')+\.ya?ml'")


def explain_refusal(setting: str) -> str:
    """Why KEY=VALUE is not taken over; "" where it is."""
    key, _, value = setting.partition("=")
    match = KEY.fullmatch(key)
    if match is None or not _is_listed(match[1]):
        return "it says more than what is computed"
    if "${" in value:
        return "its value refers to something else"
    if match[1] in CHOICES and not _is_choice(match[1], value):
        return "what is chosen there has a name"
    if key.startswith("task.") and key not in READ and set(value) & set("/\\"):
        return "it names a folder"
    return ""


def _is_choice(group: str, value: str) -> bool:
    """Whether a value is the name of a choice, or names of some, or of a model's file."""
    if NAMES.fullmatch(value):
        return True
    return group == "model" and MODEL.fullmatch(value) is not None


def _is_listed(key: str) -> bool:
    """Whether a key is one that may be repeated."""
    return key in (*CHOICES, *VALUES) or key.startswith(PARTS)
