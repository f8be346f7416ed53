# A C++20 compiler that knows GCC's vector types, or one message that says what to do.
set(stiffmap_instead "\
  A wheel needs no compiler:  pip install --only-binary :all: stiffmap
  Debian, Ubuntu:             apt install g++
  Fedora:                     dnf install gcc-c++
  macOS:                      xcode-select --install
  Windows:                    Visual Studio with its Clang tools, and  CXX=clang-cl
  conda:                      conda install -c conda-forge cxx-compiler
See docs/install.md.")
include(CheckLanguage)
check_language(CXX)
if(NOT CMAKE_CXX_COMPILER)
  message(FATAL_ERROR "stiffmap is compiled on this machine, and no C++ compiler is found (GCC 11, Clang 14 or newer).\n${stiffmap_instead}")
endif()
enable_language(CXX)
if((CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 11)
   OR (CMAKE_CXX_COMPILER_ID STREQUAL "Clang" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 14)
   OR CMAKE_CXX_COMPILER_ID STREQUAL "MSVC")
  message(FATAL_ERROR "stiffmap needs C++20 and the vector types of GCC and Clang: expected GCC 11, Clang 14 or newer, "
    "found ${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}.\n${stiffmap_instead}")
endif()
