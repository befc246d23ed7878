# Training on several processes. SUPERTAC_WITH_MPI says whether the programs that train are built with MPI; they ask it
# nothing unless mpirun started them. Nothing else is linked with it.
set(SUPERTAC_MPI AUTO CACHE STRING "Training on several processes by MPI: ON, OFF, or AUTO (where it is installed)")
set(MPI_CXX_SKIP_MPICXX ON)
if(SUPERTAC_MPI STREQUAL "AUTO")
  find_package(MPI QUIET COMPONENTS CXX)
elseif(SUPERTAC_MPI)
  find_package(MPI REQUIRED COMPONENTS CXX)
endif()
if(SUPERTAC_MPI AND MPI_CXX_FOUND AND SUPERTAC_APPS)
  set(SUPERTAC_WITH_MPI ON)
endif()
