#!/usr/bin/env bash
# Passes the tests: installs the software Vulkan driver (Mesa's lavapipe) where it is missing, then runs cargo test.
# Arguments go to cargo test.
set -eu
cd "$(dirname "$0")/.."

driver_is_there() {
    ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1' || return 1
    for folder in /usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d; do
        for file in "$folder"/lvp_icd*.json; do
            [ -e "$file" ] && return 0
        done
    done
    return 1
}

install_driver() {
    local as_root=""
    [ "$(id -u)" -eq 0 ] || as_root="sudo"
    if command -v apt-get >/dev/null; then
        $as_root apt-get update -qq
        DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends \
            libvulkan1 mesa-vulkan-drivers
    elif command -v dnf >/dev/null; then
        $as_root dnf install -y vulkan-loader mesa-vulkan-drivers
    elif command -v pacman >/dev/null; then
        $as_root pacman -S --needed --noconfirm vulkan-icd-loader vulkan-swrast
    else
        echo "The tests need Mesa's software Vulkan driver, lavapipe, and the Vulkan loader." >&2
        echo "Install them (file lvp_icd*.json in /usr/share/vulkan/icd.d, library libvulkan.so.1), then run this again." >&2
        exit 1
    fi
}

if [ "$(uname -s)" = Linux ] && ! driver_is_there; then
    echo "Installing the software Vulkan driver for the tests ..." >&2
    install_driver
fi
# Mesa's device-select layer looks for a Wayland display and complains where there is none.
export NODEVICE_SELECT=1
# What this machine has nothing of is skipped by the tests, and said here (tests/common/mod.rs).
POLHODE_SKIPPED="$(mktemp)"
export POLHODE_SKIPPED
trap 'rm -f "$POLHODE_SKIPPED"' EXIT
status=0
cargo test "$@" || status=$?
echo "$(wc -l <"$POLHODE_SKIPPED") tests had nothing to look at on this machine and were skipped"
sed 's/^/  /' "$POLHODE_SKIPPED"
exit "$status"
