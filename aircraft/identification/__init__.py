"""What an aircraft's flight logs say of its model: lift, drag, thrust and the moments, and what is not known."""
