#!/bin/sh
# Sets up everything in .venv: `sh tools/setup.sh [EXTRA…]`. Debian packages are installed where that is permitted.
set -eu
cd "$(dirname "$0")/.."

say() { printf 'setup: %s\n' "$*" >&2; }
die() { say "$*"; exit 2; }

apt_install() {
    command -v apt-get >/dev/null 2>&1 || return 1
    if [ "$(id -u)" = 0 ]; then as_root=""; elif sudo -n true 2>/dev/null; then as_root="sudo -n"; else return 1; fi
    say "installing $* with apt-get"
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q "$@" >/dev/null 2>&1 && return 0
    $as_root apt-get update -q >/dev/null 2>&1 || true
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q "$@" >/dev/null 2>&1
}

python=""
for candidate in python3 python3.11 python3.12 python3.13 python3.14; do
    if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then python=$candidate; break; fi
done
[ -n "$python" ] || die "no Python 3.11 or newer found; install one, for example: apt-get install python3"

if [ ! -x .venv/bin/python ] || ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
    rm -rf .venv
    if ! "$python" -m venv .venv >/dev/null 2>&1; then
        minor=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
        apt_install "python$minor-venv" || apt_install python3-venv ||
            die "Python lacks its venv module; install it: apt-get install python$minor-venv"
        rm -rf .venv
        "$python" -m venv .venv || die "cannot make a virtual environment in .venv; see the lines above"
    fi
fi

extras=$(printf '%s,' "$@" | sed 's/,*$//')
installed=.venv/.installed${extras:+,$extras}  # of each choice of extras: they do not remove each other
wanted=$(cat pyproject.toml constraints.txt)
if [ "$(cat "$installed" 2>/dev/null || true)" != "$wanted" ]; then
    say "installing Python packages into .venv (some minutes the first time)"
    .venv/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt -e ".${extras:+[$extras]}" ||
        die "pip could not install the packages; see the lines above"
    printf '%s\n' "$wanted" > "$installed"
fi

# What the binary packages expect of the system: library and Debian package.
has_library() { .venv/bin/python -c "import ctypes, sys; ctypes.CDLL('$1')" 2>/dev/null; }
missing=""
for entry in libOSMesa.so.8:libosmesa6 libGL.so.1:libgl1 libX11.so.6:libx11-6 libXext.so.6:libxext6 \
    libXrender.so.1:libxrender1 libatomic.so.1:libatomic1; do
    has_library "${entry%%:*}" || missing="$missing ${entry#*:}"
done
if [ -n "$missing" ]; then
    apt_install $missing ||
        die "system libraries are missing and cannot be installed here; run: sudo apt-get install$missing (where your release has no libosmesa6: libegl1, and backend: egl in the configuration)"
fi

# Tests open pages in a browser; where there is none they are skipped.
case ",$extras," in *,dev,*)
    if ! command -v chromium >/dev/null 2>&1 && ! command -v google-chrome >/dev/null 2>&1; then
        apt_install chromium || say "no chromium here and none can be installed: pages will not be opened by tests"
    fi ;;
esac
