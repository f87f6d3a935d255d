"""``truetip frame``, ``chain``, ``tool`` and ``align``: frames and tools from text files."""
