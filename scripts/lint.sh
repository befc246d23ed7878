#!/bin/sh
# What reads the sources without running them; any finding is an error: clang-format, shellcheck, lines, the arrows of the
# includes, and clang-tidy (.clang-tidy says which checks). The last needs BUILD, a folder that was configured for
# clang with -DCMAKE_EXPORT_COMPILE_COMMANDS=ON; without it clang-tidy is left out. FILES: only these for clang-tidy.
#   scripts/lint.sh [BUILD [FILES]]
set -eu
cd "$(dirname "$0")/.."
scripts/setup.sh clang-format clang-tidy shellcheck python3
git ls-files '*.h' '*.cpp' '*.inl' | xargs clang-format --dry-run -Werror
git ls-files '*.sh' .ci/run | xargs shellcheck --severity=warning
scripts/check_includes.py
scripts/check_budget.py
[ $# -ge 1 ] || exit 0
build="$1"
shift
if [ $# -eq 0 ]; then
  # shellcheck disable=SC2046
  set -- $(git ls-files 'io/*.cpp' 'autograd/*.cpp' 'layers/*.cpp' 'data/*.cpp' 'models/*.cpp' 'hardware/*.cpp' 'apps/*.cpp')
fi
# Only what that build compiles: without MPI its files have no header.
for file; do
  if grep -q "/$file\"" "$build/compile_commands.json"; then printf '%s\n' "$file"; fi
done | xargs -P 2 -n 4 clang-tidy --quiet -p "$build"
