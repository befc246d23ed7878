#!/bin/sh
# The libraries installed in five layouts, and linked from each by pkg-config and by find_package: C and C++.
#   layouts.sh SOURCE BUILD
# BUILD has been built; its files are taken as they are, since only where they are put is the matter.
set -eu
source=$1 build=$2
# CMake refuses absolute folders within the source tree.
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/user"
cat > "$folder/user/CMakeLists.txt" <<EOF
cmake_minimum_required(VERSION 3.22)
project(user LANGUAGES C CXX)
find_package(supertac REQUIRED)
add_executable(draw_live $source/examples/draw_live.c)
target_link_libraries(draw_live PRIVATE supertac::c)
add_executable(vae $source/examples/vae.cpp)
target_link_libraries(vae PRIVATE supertac::supertac_layers supertac::supertac_images)
EOF
try() { # NAME LIBDIR INCLUDEDIR
  name=$1 libdir=$2 includedir=$3 here=$folder/$1
  prefix=$here/prefix
  cmake -S "$source" -B "$here/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSUPERTAC_APPS=OFF -DSUPERTAC_TESTS=OFF \
    -DCMAKE_INSTALL_PREFIX="$prefix" -DCMAKE_INSTALL_LIBDIR="$libdir" -DCMAKE_INSTALL_INCLUDEDIR="$includedir" > "$here.log"
  (cd "$build" && find . -name 'libsupertac*' \( -name '*.a' -o -name '*.so*' \)) |
    while read -r file; do
      mkdir -p "$here/build/$(dirname "$file")"
      cp -a "$build/$file" "$here/build/$file"
    done
  cmake --install "$here/build" --component development >> "$here.log"
  cmake --install "$here/build" --component programs >> "$here.log"
  case $libdir in /*) lib=$libdir ;; *) lib=$prefix/$libdir ;; esac
  export PKG_CONFIG_PATH="$lib/pkgconfig" LD_LIBRARY_PATH="$lib"
  # shellcheck disable=SC2046  # flags are words
  cc -std=c99 "$source/examples/draw_live.c" -o "$here/draw_live" $(pkg-config --cflags --libs supertac)
  # shellcheck disable=SC2046
  c++ -std=c++20 "$source/examples/vae.cpp" -o "$here/vae" $(pkg-config --cflags --libs supertac-cpp)
  cmake -S "$folder/user" -B "$here/user" -G Ninja -DCMAKE_PREFIX_PATH="$prefix" -Dsupertac_DIR="$lib/cmake/supertac" \
    >> "$here.log"
  cmake --build "$here/user" >> "$here.log"
  for program in "$here/draw_live" "$here/user/draw_live"; do
    "$program" missing.safetensors 100 < /dev/null 2> "$here/said" && exit 1
    grep -q missing.safetensors "$here/said"
  done
  for program in "$here/vae" "$here/user/vae"; do
    "$program" "$here/vae.png" | grep -q "never seen: squared error 0[.]001"
  done
  echo "$name: linked"
  rm -rf "$here"
}
try usual lib include
try triplet lib/x86_64-linux-gnu include
try elsewhere "$folder/elsewhere/away/lib" "$folder/elsewhere/away/headers"
try inside "$folder/inside/prefix/lib64" include
try headers lib "$folder/headers/away"
