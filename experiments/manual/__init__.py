"""Pages of the manual that the program writes itself: commands, fields of files, chapters of the README."""
