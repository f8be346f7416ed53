"""Names for screen readers: viser's client labels the first field of a row at best, and no button with a picture; a
script in the page names all."""

from __future__ import annotations

import gzip
from functools import lru_cache

SCRIPT = """<script>(() => {
  const buttons = {
    "button:has(.tabler-icon-list-search)": "Search commands",
    "button:has(.tabler-icon-adjustments)": "Connection, camera and scene",
    ".mantine-Notification-closeButton": "Close the message",
  };
  const fields = () => document.querySelectorAll("label[for]").forEach(label => {
    const row = label.closest(".mantine-Flex-root");
    const found = row ? [...row.querySelectorAll("input:not([type=hidden]), textarea, [role=slider]")] : [];
    found.forEach((field, i) => {
      const text = label.textContent + (found.length === 3 ? ", " + "xyz"[i] : "");
      if (field.getAttribute("aria-label") !== text) field.setAttribute("aria-label", text);
    });
  });
  const name = () => {
    fields();
    for (const [where, text] of Object.entries(buttons))
      document.querySelectorAll(where + ":not([aria-label])").forEach(b => b.setAttribute("aria-label", text));
  };
  let waiting = false;
  new MutationObserver(() => {
    if (!waiting) { waiting = true; setTimeout(() => { waiting = false; name(); }, 250); }
  }).observe(document, {childList: true, subtree: true});
})();</script>"""


@lru_cache(maxsize=4)
def named(body: bytes, packed: bool) -> bytes:
    """The page with the script in its head; `packed`: as it is sent, by gzip."""
    text = gzip.decompress(body) if packed else body
    head, end, tail = text.partition(b"</head>")
    out = head + SCRIPT.encode() + end + tail if end else text
    return gzip.compress(out, mtime=0) if packed else out
