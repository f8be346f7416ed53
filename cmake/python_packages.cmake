# Outside a plain pip build: let CMake see what the active Python environment brings (Eigen, Boost headers).
find_package(Python 3.11 QUIET COMPONENTS Interpreter)
if(Python_FOUND)
  execute_process(COMMAND ${Python_EXECUTABLE} -c "import sysconfig; print(sysconfig.get_path('purelib'))"
    OUTPUT_VARIABLE stiffmap_site_packages OUTPUT_STRIP_TRAILING_WHITESPACE)
  list(APPEND CMAKE_PREFIX_PATH ${stiffmap_site_packages})
endif()
