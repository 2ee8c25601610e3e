"""The tendon-driven soft arm: by Exudyn, and by compiled kernels."""
