"""Other processors than the one that the tests run on, as far as a variable of the environment can have it."""

from typing import Any

import numpy as np

# `mode` is of NumPy 1.26 and later.
_CONFIGURATION: Any = np.show_config(mode="dicts")
# None of the features that NumPy has code of its own for: its sines with AVX-512 differ in the last digit from others'.
NUMPY_ON_BASELINE_CPU = {"NPY_DISABLE_CPU_FEATURES": " ".join(_CONFIGURATION["SIMD Extensions"].get("found", []))}
