# cmake -DCMAKE_TOOLCHAIN_FILE=cmake/aarch64.cmake: for aarch64, with Debian's cross compiler; tests run under emulation
# (scripts/aarch64.sh).
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
# FindOpenMP asks the build machine's own compiler otherwise.
file(GLOB gomp /usr/lib/gcc-cross/aarch64-linux-gnu/*/libgomp.so)
set(OpenMP_gomp_LIBRARY "${gomp}" CACHE FILEPATH "")
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64)
