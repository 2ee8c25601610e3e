"""What runs on the free-flyer's computer: handover sequence, impedance and pose control."""
