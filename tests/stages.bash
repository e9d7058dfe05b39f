# Functions of tests/run: installation, and stages with their times and counts. Sourced, not executed.
# shellcheck shell=bash

passed=0 failed=0 skipped=0 processor_in_all=0 table=()
work=$(mktemp -d)
log=$work/log notes=$work/notes times=$work/times
: >"$notes" >"$times"
trap 'kill $(jobs -p) 2>/dev/null; rm -rf "$work"' EXIT
# Folder of the lane that runs; empty outside of lanes.
lane=

has() { command -v "$1" >/dev/null 2>&1; }

note() { echo "$1" >>"$notes"; }

# Unicorn, the processor of the emulated board, is built from C sources with bindings that libclang makes.
has_libclang() {
    ls /usr/lib/llvm-*/lib/libclang.so* >/dev/null 2>&1 && ls /usr/lib/llvm-*/lib/clang/*/include/stdbool.h >/dev/null 2>&1
}

# Prints the Debian packages that are missing, each found by a program or header it contains.
missing() {
    has cc && has c++ || echo build-essential
    has python3 || echo python3
    has linux.uml || echo user-mode-linux
    has insmod || [ -x /usr/sbin/insmod ] || echo kmod
    has ip || [ -x /usr/sbin/ip ] || echo iproute2
    has candump || echo can-utils
    has cmake || echo cmake
    has_libclang || echo libclang-dev
    python3 -c 'import ensurepip' >/dev/null 2>&1 || echo python3-venv
    # Ubuntu's chromium package is a stub for a snap, which containers cannot install. Any browser will do.
    has chromium || has chromium-browser || has google-chrome || has google-chrome-stable \
        || grep -qs '^ID=ubuntu' /etc/os-release || echo chromium
}

install_packages() {
    local packages=() sudo=()
    mapfile -t packages < <(missing)
    [ ${#packages[@]} -gt 0 ] || return 0
    echo "   ${packages[*]}"
    [ "$(id -u)" -eq 0 ] || sudo=(sudo -n)
    if ! has apt-get; then
        note "no apt-get here; install by hand: ${packages[*]}"
        return 0
    fi
    export DEBIAN_FRONTEND=noninteractive
    local apt=("${sudo[@]}" timeout 900 apt-get -qq -o Acquire::Retries=1 -o Acquire::http::Timeout=30)
    "${apt[@]}" update || true
    "${apt[@]}" install -y --no-install-recommends "${packages[@]}" >/dev/null && return 0
    for package in "${packages[@]}"; do
        # One by one: a package that is not available must not block the others.
        "${apt[@]}" install -y --no-install-recommends "$package" >/dev/null \
            || note "$package could not be installed"
    done
}

install_toolchain() {
    if ! has rustup; then
        note "rustup is missing: the toolchain of rust-toolchain.toml was not checked"
        return 0
    fi
    # rust-toolchain.toml names the toolchain, its components and the target. Old and new versions of rustup
    # use different commands to install it.
    rustup show active-toolchain >/dev/null 2>&1 || rustup toolchain install >/dev/null 2>&1 || true
    local components
    rustup target list --installed | grep -q thumbv7em-none-eabihf \
        || rustup target add thumbv7em-none-eabihf
    # Only the page for browsers needs this target. Its stages are skipped without it.
    rustup target list --installed | grep -q wasm32-unknown-unknown \
        || rustup target add wasm32-unknown-unknown || true
    components=$(rustup component list --installed)
    for component in rustfmt clippy; do
        grep -q "^$component" <<<"$components" || rustup component add "$component"
    done
    # Miri is part of nightly toolchains only. Without one, its stage is skipped with that reason.
    cargo +nightly miri --version >/dev/null 2>&1 \
        || timeout 600 rustup toolchain install nightly --profile minimal -c miri -c rust-src \
            >/dev/null 2>&1 || true
}

# Runs a command: `timed FILE COMMAND...`. Its output goes to FILE; exit code, wall time and processor time go to
# FILE.took. A subshell measures the times, because the times of this shell include lanes that end meanwhile.
timed() {
    local file=$1 begin=$SECONDS
    shift
    (
        "$@" >"$file" 2>&1 </dev/null
        code=$?
        times >"$file.times"
        exit "$code"
    )
    local code=$?
    awk -v code="$code" -v took=$((SECONDS - begin)) 'NR == 2 {
        for (i = 1; i <= 2; i++) { split($i, part, /[ms]/); s += 60 * part[1] + part[2] }
        printf "%d %d %d\n", code, took, s }' "$file.times" >"$file.took"
}

# Adds the times of a command to the table: `record_times NAME FILE`. Sets `code` to its exit code, `wall` and `used` to its
# times, s, and `took` to the printed times.
record_times() {
    read -r code wall used <"$2.took"
    took=$(printf '%4d s, processor %4d s' "$wall" "$used")
    table+=("$took  $1")
    processor_in_all=$((processor_in_all + used))
}

# Counts the tests of a finished stage: `count KEY NAME FILE`. It reads cargo's "test result: ok. N passed; N failed" and
# the scripts' "NAME: N passed, N failed". A test that cannot run prints "skipped: " and the reason. Cargo counts such
# a test as passed, so it is subtracted here; the scripts do not count it.
count() {
    local key=$1 name=$2 file=$3 code wall used took p f s
    record_times "$name" "$file"
    read -r p f s < <(awk '
        /^test result: / {
            for (i = 2; i <= NF; i++) {
                if ($i ~ /^passed/) p += $(i - 1)
                if ($i ~ /^failed/) f += $(i - 1)
            }
        }
        /^[^ ]+: [0-9]+ passed, [0-9]+ failed/ { p += $2; f += $4 }
        /^running [0-9]+ tests?$/ { cargo = 1 }
        /^---- .* stdout ----$/ { reported = 0 }
        /^skipped: / { if (!cargo) s += 1; else if (!reported) { reported = 1; p -= 1; s += 1 } }
        END { print p + 0, f + 0, s + 0 }' "$file")
    if [ "$((p + f + s))" -eq 0 ]; then
        if [ "$code" -eq 0 ]; then p=1; else f=1; fi
    elif [ "$code" -ne 0 ] && [ "$f" -eq 0 ]; then
        # The stage failed outside its tests: something did not compile, or crashed.
        f=1
    fi
    passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
    grep '^skipped: ' "$file" | sort -u >>"$notes"
    if [ "$code" -ne 0 ]; then
        note "failed: $name"
        tail -n 300 "$file"
    fi
    echo "   $p passed, $f failed, $s skipped in $took"
    # Only a stage that executed something has a time that can be compared.
    printf '%s\t%s\t%s\t%s\t%s\n' "$key" "$name" "$wall" "$used" "$([ $((p + f)) -gt 0 ] && echo ran || echo skipped)" \
        >>"$times"
}

# Runs a stage: `stage KEY NAME COMMAND...`. In a lane, the tests are counted when the lane is joined.
stage() {
    if [ -n "$lane" ]; then
        place=$((place + 1))
        printf '%s\n%s\n' "$1" "$2" >"$lane/$place.name"
        timed "$lane/$place" "${@:3}"
    else
        echo "== $2"
        timed "$log" "${@:3}"
        count "$1" "$2" "$log"
    fi
}

# Skips a stage with a reason: `skip KEY NAME REASON`.
skip() { stage "$1" "$2" echo "skipped: $2: $3"; }

# Runs a command that is not a test.
install() {
    local code wall used took
    echo "== $1"
    timed "$log" "${@:2}"
    cat "$log"
    record_times "$1" "$log"
}

# A lane runs stages one after the other, in parallel with the stages that follow. It suits stages that use one processor or
# mostly wait. `start_lane NAME FUNCTION`, and `join_lane NAME`, which waits for the lane and counts its tests.
start_lane() {
    mkdir "$work/$1"
    (
        lane=$work/$1 place=10
        "$2"
    ) &
    echo "$!" >"$work/$1.pid"
}

join_lane() {
    local key name file
    wait "$(<"$work/$1.pid")"
    for file in "$work/$1"/*.name; do
        { read -r key; read -r name; } <"$file"
        echo "== $name, in parallel"
        count "$key" "$name" "${file%.name}"
    done
}
