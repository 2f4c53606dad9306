"""Files, processes and extras of the machine; nothing here knows masonry."""
