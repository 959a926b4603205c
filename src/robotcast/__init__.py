"""Real2Sim2Real experiments for Planar Robot Casting."""

import os
import platform

# One path of arithmetic on every x86-64 processor with AVX2: libraries that choose wider
# instructions where a processor has them round the last bits otherwise, and DVC's hashes with them.
ONE_PATH = {
    "ATEN_CPU_CAPABILITY": "avx2",
    "MKL_CBWR": "AVX2",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "ONEDNN_MAX_CPU_ISA": "AVX2",
    "OPENBLAS_CORETYPE": "Haswell",
}
if platform.machine() in ("x86_64", "AMD64"):
    for _name, _value in ONE_PATH.items():
        os.environ.setdefault(_name, _value)
