"""How far a robot keeps from people, and how fast it may go. An aid, not a safety function."""
