# Builds the kernels once per instruction-set level, each a private shared library with one exported
# symbol: objects of one source for several levels must not meet in one link.
include(CheckCXXCompilerFlag)

# What every build of the kernels' source is compiled with, here and in bench.
add_library(stiffmap_kernel_options INTERFACE)
target_compile_options(stiffmap_kernel_options INTERFACE
  -fno-math-errno -fno-trapping-math -ffp-contract=fast -fno-semantic-interposition $<$<CONFIG:Release>:-O3>)
# Structs of some kB are copied and cleared at every turn; GCC would do that by string instructions, which start slowly.
set(copies -mmemcpy-strategy=vector_loop:-1:align -mmemset-strategy=vector_loop:-1:align)
check_cxx_compiler_flag("${copies}" STIFFMAP_HAS_VECTOR_COPIES)
if(STIFFMAP_HAS_VECTOR_COPIES)
  target_compile_options(stiffmap_kernel_options INTERFACE ${copies})
endif()
# Costs of a recent processor, also where another one runs them: up to a tenth less time than with the generic ones.
check_cxx_compiler_flag(-mtune=icelake-server STIFFMAP_HAS_TUNING)
if(STIFFMAP_HAS_TUNING)
  target_compile_options(stiffmap_kernel_options INTERFACE -mtune=icelake-server)
endif()

# Wide levels have a narrow companion for calls on one or two poses, v3_pair: `name` is the level or the level and _pair.
function(stiffmap_kernel name lanes)
  set(target stiffmap_kernel_${name})
  string(REPLACE "_pair" "" level ${name})
  add_library(${target} SHARED ${PROJECT_SOURCE_DIR}/cpp/kernels/kernel.cpp)
  target_compile_definitions(${target} PRIVATE
    STIFFMAP_LANES=${lanes} STIFFMAP_LEVEL="${level}" STIFFMAP_ENTRY=${target})
  target_link_libraries(${target} PRIVATE stiffmap_kernel_options)
  target_compile_options(${target} PRIVATE ${ARGN})
  stiffmap_compile_options(${target})
  set_target_properties(${target} PROPERTIES CXX_VISIBILITY_PRESET hidden WINDOWS_EXPORT_ALL_SYMBOLS ON)
  if(SKBUILD)
    install(TARGETS ${target} LIBRARY DESTINATION . COMPONENT python RUNTIME DESTINATION . COMPONENT python)
  endif()
endfunction()

set(STIFFMAP_KERNELS stiffmap_kernel_base)
stiffmap_kernel(base 2)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  check_cxx_compiler_flag(-march=x86-64-v4 STIFFMAP_HAS_LEVELS)
  if(STIFFMAP_HAS_LEVELS)
    stiffmap_kernel(v3 4 -march=x86-64-v3)
    stiffmap_kernel(v3_pair 2 -march=x86-64-v3)
    stiffmap_kernel(v4 8 -march=x86-64-v4 -mprefer-vector-width=512)
    list(APPEND STIFFMAP_KERNELS stiffmap_kernel_v3 stiffmap_kernel_v3_pair stiffmap_kernel_v4)
  endif()
endif()
