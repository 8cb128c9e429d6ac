"""Robot descriptions as others write them: each loads as a sound one does and says what was assumed, or is refused."""
