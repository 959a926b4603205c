"""Work done in processes of its own, which end with the one that started them."""
