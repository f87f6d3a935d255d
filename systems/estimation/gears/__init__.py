"""What gears have beyond their springs, and what is fed back of what no model foresees of it."""
