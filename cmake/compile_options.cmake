# The one function that sets flags on a target of ours.
function(stiffmap_compile_options target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow)
  if(STIFFMAP_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(CMAKE_BUILD_TYPE STREQUAL "Release")
    target_compile_options(${target} PRIVATE -O3 -fno-math-errno)
  endif()
  if(STIFFMAP_SANITIZE)
    # What null, object-size and vptr would see, the address sanitizer sees as well; without them templates of Eigen
    # compile in three quarters of the time.
    target_compile_options(${target} PRIVATE -fsanitize=address,undefined -fno-sanitize=null,object-size,vptr
      -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=address,undefined)
  endif()
  if(STIFFMAP_SANITIZE_THREADS)
    target_compile_options(${target} PRIVATE -fsanitize=thread -g)
    target_link_options(${target} PUBLIC -fsanitize=thread)
  endif()
endfunction()
