"""A browser of this machine, and what it makes of a page."""

import shutil
import subprocess

WHEN_DRAWN = """const work = () => {%s};
    if (document.querySelector(".chart")) document.addEventListener("drawn", work); else work();"""
BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)


def drawn(page, folder, *options):
    """What a browser that reaches no other computer makes of a page: its elements, and what it
    complains of.
    """
    path = page.save(folder / "page.html")
    command = [
        BROWSER,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--no-first-run",
        "--disable-background-networking",
        f"--user-data-dir={folder / 'browser'}",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        "--enable-logging=stderr",
        "--v=0",
        "--virtual-time-budget=5000",
        *options,
        "--dump-dom",
        path.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


class Worked:
    """A page, and what a person does with it: a script that runs once the page is drawn."""

    def __init__(self, page, script):
        self.page, self.script = page, script

    def save(self, path):
        text = self.page.save(path).read_text(encoding="utf-8")
        path.write_text(
            text.replace(
                "</body>", f"<p id=told></p><script>{WHEN_DRAWN % self.script}</script></body>"
            )
        )
        return path
