#include <gtest/gtest.h>

#include <cmath>

#include "alidade/files/files.h"
#include "alidade/heads/protocols/indi_link.h"
#include "alidade/heads/protocols/onvif_protocol.h"
#include "alidade/heads/protocols/soap.h"

namespace alidade {
namespace {

TEST(Soap, DigestIsThatOfOnvifsOwnExample) {  // ONVIF Application Programmer's Guide 1.0, 6.1.1.3
  EXPECT_EQ(password_digest(base64_bytes("LKqI6G/AikKCQrN0zqZFlg=="), "2010-09-16T07:50:45Z", "userpassword"),
            "tuOSpGlFlIXsozq4HFNeeGeFLEI=");
}

TEST(Soap, Base64) {  // RFC 4648, 10
  for (const auto& [bytes, text] : {std::pair{"", ""},
                                    {"f", "Zg=="},
                                    {"fo", "Zm8="},
                                    {"foo", "Zm9v"},
                                    {"foob", "Zm9vYg=="},
                                    {"fooba", "Zm9vYmE="},
                                    {"foobar", "Zm9vYmFy"}}) {
    EXPECT_EQ(base64_text(bytes), text);
    EXPECT_EQ(base64_bytes(text), bytes);
  }
}

TEST(Soap, TimesAndTokens) {
  EXPECT_EQ(utc_text(1284623445.9), "2010-09-16T07:50:45Z");
  EXPECT_EQ(utc_seconds("2010-09-16T07:50:45Z"), 1284623445.0);
  EXPECT_DOUBLE_EQ(utc_seconds("2010-09-16T07:50:45.25"), 1284623445.25);  // as FITS writes it
  for (const char* none : {"", "yesterday", "2010-13-16T07:50:45Z", "2010-02-30T07:50:45Z"})
    EXPECT_TRUE(std::isnan(utc_seconds(none))) << none;
  const UsernameToken one = username_token("me", "secret", 1284623445.0),
                      two = username_token("me", "secret", 1284623445.0);
  EXPECT_NE(one.nonce, two.nonce);
  EXPECT_EQ(soap_request(one, "<A/>").find("secret"), std::string::npos);
  EXPECT_EQ(escaped_xml("<a&\"b\">"), "&lt;a&amp;&quot;b&quot;&gt;");
}

TEST(Indi, ElementsOfAStreamThatComesInPieces) {
  const std::string stream =
      "<?xml version='1.0'?>\n<message device='a' message='x > y'/>\n<defNumberVector name=\"A\"><defNumber "
      "name=\"N\">\n5\n"
      "</defNumber></defNumberVector>  <delProperty device='a'/>";
  for (const std::size_t piece : {std::size_t(1), std::size_t(7), stream.size()}) {
    XmlElements elements("test");
    std::vector<std::string> found;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      elements.push(std::string_view(stream).substr(at, piece));
      for (std::string next = elements.next(); !next.empty(); next = elements.next()) found.push_back(next);
    }
    ASSERT_EQ(found.size(), 4u) << piece;
    EXPECT_EQ(found[1], "<message device='a' message='x > y'/>");
    EXPECT_TRUE(found[2].starts_with("<defNumberVector") && found[2].ends_with("</defNumberVector>"));
  }
  XmlElements noise("test");
  noise.push("HTTP/1.1 200");
  EXPECT_THROW((void)noise.next(), InputError);
}

TEST(Indi, Sexagesimal) {
  EXPECT_DOUBLE_EQ(sexagesimal("12.5"), 12.5);
  EXPECT_DOUBLE_EQ(sexagesimal("-0:30:36"), -0.51);
  EXPECT_DOUBLE_EQ(sexagesimal("21 15 00"), 21.25);
  EXPECT_DOUBLE_EQ(sexagesimal("12:30"), 12.5);
  EXPECT_DOUBLE_EQ(sexagesimal("-12: 30: 15.0"), -12.504166666666666);
  for (const char* none : {"north", "", "12,5", "12.5h", "1:2:3:4", "1:-2:3", "1:x", "nan"})
    EXPECT_TRUE(std::isnan(sexagesimal(none))) << none;
}

TEST(OnvifCamera, AnswersFaultsToWhatItDoesNotUnderstand) {
  HeadPlant plant(simulated_head_config("rate=40", "test"), 100.0);
  OnvifCamera open_to_all(plant, {}), guarded(plant, {.user = "me", .password = "secret"});
  for (const std::string bad :
       {"", "<", "<a/>", "<Envelope><Body></Body></Envelope>", "\x01\x02", "<Envelope><Body><Fly/></Body></Envelope>",
        "<Envelope><Body><AbsoluteMove><Position><PanTilt x='nan' y='0'/></Position></AbsoluteMove></Body></Envelope>",
        "<Envelope><Body><AbsoluteMove><Position><PanTilt x='1.7' "
        "y='0'/></Position></AbsoluteMove></Body></Envelope>"}) {
    const OnvifCamera::Answer answer = open_to_all.answer(bad, 101.0);
    EXPECT_EQ(answer.status, 400) << bad;
    EXPECT_NE(answer.body.find("Fault"), std::string::npos) << bad;
  }
  EXPECT_TRUE(plant.is_at_rest(102.0));  // nothing moved
  const std::string body = "<GetStatus xmlns=\"http://www.onvif.org/ver20/ptz/wsdl\"/>";
  EXPECT_EQ(open_to_all.answer(soap_request({}, body), 103.0).status, 200);
  EXPECT_EQ(guarded.answer(soap_request({}, body), 103.0).status, 400);
  const std::string once = soap_request(username_token("me", "secret", 103.0), body);
  EXPECT_EQ(guarded.answer(once, 103.0).status, 200);
  EXPECT_EQ(guarded.answer(once, 103.0).status, 400);  // a nonce is good once
  EXPECT_EQ(guarded.answer(soap_request(username_token("me", "wrong", 103.0), body), 103.0).status, 400);
  EXPECT_EQ(guarded.answer(soap_request(username_token("me", "secret", 103.0), body), 600.0).status, 400);  // too old
}

}  // namespace
}  // namespace alidade
