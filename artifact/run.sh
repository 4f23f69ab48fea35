#!/usr/bin/env bash
# Makes the README's first picture and its table of speed and error, on a bare Debian or Ubuntu:
# installs a compiler and a software Vulkan driver where they are missing, builds epsplat, and
# writes artifact/out/autzen.png and artifact/out/table.md. It takes no parameters, and about ten
# minutes on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."

# Installs packages of Debian and Ubuntu.
install() {
    local sudo
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@"
}

command -v cc >/dev/null && command -v curl >/dev/null || install build-essential ca-certificates curl
if ! command -v cargo >/dev/null; then
    curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh -s -- -y --profile minimal
    export PATH="$HOME/.cargo/bin:$PATH"
fi
cargo build --release --locked
epsplat=${CARGO_TARGET_DIR:-target}/release/epsplat
# Pictures have the same bits on one driver; the times are those of this machine.
if [[ $("$epsplat" adapters --json - 2>/dev/null) != *'"vulkan"'* ]]; then
    install mesa-vulkan-drivers libvulkan1
fi
mkdir -p artifact/out
"$epsplat" render data/autzen.laz -o artifact/out/autzen.png
"$epsplat" bench benches/readme.toml --out artifact/out/report --table >artifact/out/table.md
cat artifact/out/table.md
echo "artifact/out has the picture, the table, and the report with every run"
