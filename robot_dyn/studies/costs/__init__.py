"""What effects and algorithms cost on one arm."""
