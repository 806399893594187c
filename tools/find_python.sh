#!/bin/sh
# Print the path of a Python (3.11 or newer, with pip) that can run tools/bootstrap.py; PYTHON=... is tried first.
# Candidates run outside the repository: there pyenv's shims would obey .python-version and fail without a 3.13.

found='import sys; sys.exit(sys.version_info < (3, 11))'
usable='import sys, pip; sys.version_info < (3, 11) and sys.exit(1); print(sys.executable)'

try() { (cd / && "$@") 2>/dev/null; }

if [ -n "${PYTHON:-}" ]; then
    "$PYTHON" -c "$usable" 2>/dev/null && exit 0
    echo "PYTHON=$PYTHON is not a Python 3.11 or newer with pip: name another one, or leave PYTHON out." >&2
    exit 1
fi

names="python3.13 python3 python python3.14 python3.12 python3.11 /usr/bin/python3"
for name in $names; do
    try "$name" -c "$usable" && exit 0
done

# Pythons that pyenv has installed but not selected.
for version in $(try pyenv versions --bare); do
    PYENV_VERSION=$version try python -c "$usable" && exit 0
done

for name in $names; do
    if try "$name" -c "$found"; then
        echo "$name has no pip: install it (Debian, Ubuntu: apt install python3-pip) and run make again." >&2
        exit 1
    fi
done
echo "No Python 3.11 or newer was found: install one (Debian, Ubuntu: apt install python3 python3-pip) and run make again." >&2
exit 1
