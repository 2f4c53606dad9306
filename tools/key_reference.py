"""Write the reference of case and study files into a folder: python tools/key_reference.py docs/reference."""

import sys

from blockvis.reference.pages import write_pages


def main(arguments: list[str]) -> int:
    """Write the pages into the folder of the command line."""
    if len(arguments) != 1:
        print("give one folder: python tools/key_reference.py docs/reference", file=sys.stderr)
        return 2
    for path in write_pages(arguments[0]):
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
