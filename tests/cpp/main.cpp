// SPDX-License-Identifier: MIT
#define BOOST_TEST_MODULE stiffmap
#include <boost/test/included/unit_test.hpp>
